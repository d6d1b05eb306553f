// A surface that turns by dragging or arrow keys: triangles with a depth buffer, because WebGL is not everywhere.
(() => {
  for (const canvas of document.querySelectorAll("canvas[data-heights]")) {
    const image = new Image();
    image.onload = () => show(canvas, image);
    image.src = `data:image/png;base64,${canvas.dataset.colours}`;
  }

  function show(canvas, image) {
    const n = Number(canvas.dataset.nodes), relief = Number(canvas.dataset.relief), map = image.width;
    const heights = new Uint16Array(Uint8Array.from(atob(canvas.dataset.heights), (c) => c.charCodeAt(0)).buffer);
    const buffer = new OffscreenCanvas(map, map).getContext("2d");
    buffer.drawImage(image, 0, 0);
    const colours = buffer.getImageData(0, 0, map, map).data;
    const z = Float32Array.from(heights, (h) => relief * (h / 65535 - 0.5));
    const steep = (a, b, run) => ((z[b] - z[a]) * (n - 1)) / run;
    const x = new Float32Array(n * n), y = new Float32Array(n * n), depth = new Float32Array(n * n);
    const light = new Float32Array(n * n);
    const context = canvas.getContext("2d");
    const { side, range } = canvas.dataset;
    let turn = 0.6, tilt = 0.75, waiting = false;

    function draw() {
      waiting = false;
      const dots = Math.min(devicePixelRatio, 2), width = Math.round(canvas.clientWidth * dots);
      const height = Math.round(canvas.clientHeight * dots);
      canvas.width = width;
      canvas.height = height;
      const size = Math.min(0.56 * width, 0.74 * height);
      const [c, s, ct, st] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)];
      for (let j = 0, k = 0; j < n; j++) {
        for (let i = 0; i < n; i++, k++) {
          const u = i / (n - 1) - 0.5, v = j / (n - 1) - 0.5, far = v * c + u * s;
          x[k] = width / 2 + size * (u * c - v * s);
          y[k] = height / 2 - size * (far * st + z[k] * ct);
          depth[k] = far * ct - z[k] * st;
          const i0 = Math.max(i - 1, 0), i1 = Math.min(i + 1, n - 1), j0 = Math.max(j - 1, 0), j1 = Math.min(j + 1, n - 1);
          const a = steep(j * n + i0, j * n + i1, i1 - i0), b = steep(j0 * n + i, j1 * n + i, j1 - j0);
          // light from the upper left of the viewer
          const sun = -0.45 * (-a * c + b * s) + 0.25 * (a * s + b * c) + 0.86;
          light[k] = 0.35 + 0.65 * Math.max(0, sun / Math.sqrt(1 + a * a + b * b));
        }
      }
      const picture = context.createImageData(width, height), nearest = new Float32Array(width * height).fill(9);
      for (let j = 0; j + 1 < n; j++) {
        for (let i = 0; i + 1 < n; i++) {
          const k = j * n + i;
          fill(picture, nearest, k, k + 1, k + n + 1);
          fill(picture, nearest, k, k + n + 1, k + n);
        }
      }
      context.putImageData(picture, 0, 0);
      const at = (u, v, w) => [width / 2 + size * (u * c - v * s), height / 2 - size * ((v * c + u * s) * st + w * ct)];
      const near = s < 0 ? 0.5 : -0.5, front = c < 0 ? 0.5 : -0.5; // u and v of the edges next to the viewer
      const [u, v] = at(near, -front, 0)[0] < at(-near, front, 0)[0] ? [near, -front] : [-near, front];
      context.strokeStyle = context.fillStyle = "#444";
      context.font = `${13 * dots}px system-ui, sans-serif`;
      context.textAlign = "center";
      context.textBaseline = "middle";
      arrow(at(-0.5, front, -relief / 2), at(0.5, front, -relief / 2), `x, ${side}`, 13 * dots);
      arrow(at(near, -0.5, -relief / 2), at(near, 0.5, -relief / 2), `y, ${side}`, 13 * dots);
      if (ct > 0.2) arrow(at(u, v, -relief / 2), at(u, v, relief / 2), range, 13 * dots);
    }

    // an arrow with a text beside it, away from the middle
    function arrow([x0, y0], [x1, y1], text, letter) {
      const long = Math.hypot(x1 - x0, y1 - y0), ex = (letter * (x1 - x0)) / long, ey = (letter * (y1 - y0)) / long;
      const [mx, my, half] = [(x0 + x1) / 2, (y0 + y1) / 2, context.measureText(text).width / 2];
      const out = (mx - canvas.width / 2) * ey < (my - canvas.height / 2) * ex ? -1 : 1;
      context.beginPath();
      context.moveTo(x0, y0);
      context.lineTo(x1, y1);
      context.lineTo(x1 - 0.6 * ex - 0.3 * ey, y1 - 0.6 * ey + 0.3 * ex);
      context.moveTo(x1, y1);
      context.lineTo(x1 - 0.6 * ex + 0.3 * ey, y1 - 0.6 * ey - 0.3 * ex);
      context.stroke();
      const beside = mx + out * ey * (0.6 + half / letter);
      context.fillText(text, Math.min(Math.max(beside, half), canvas.width - half), my - out * ex);
    }

    function fill(picture, nearest, p, q, r) {
      const { width, height, data } = picture;
      const area = (x[q] - x[p]) * (y[r] - y[p]) - (x[r] - x[p]) * (y[q] - y[p]);
      if (area === 0) return;
      const left = Math.max(0, Math.ceil(Math.min(x[p], x[q], x[r]))), top = Math.max(0, Math.ceil(Math.min(y[p], y[q], y[r])));
      const right = Math.min(width - 1, Math.max(x[p], x[q], x[r])), bottom = Math.min(height - 1, Math.max(y[p], y[q], y[r]));
      const grid = (map - 1) / (n - 1), column = (k) => (k % n) * grid, row = (k) => Math.floor(k / n) * grid;
      for (let v = top; v <= bottom; v++) {
        for (let u = left; u <= right; u++) {
          const b = ((u - x[p]) * (y[r] - y[p]) - (x[r] - x[p]) * (v - y[p])) / area;
          const c = ((x[q] - x[p]) * (v - y[p]) - (u - x[p]) * (y[q] - y[p])) / area, a = 1 - b - c;
          if (a < -1e-6 || b < -1e-6 || c < -1e-6) continue;
          const at = v * width + u, far = a * depth[p] + b * depth[q] + c * depth[r];
          if (far >= nearest[at]) continue;
          nearest[at] = far;
          const bright = a * light[p] + b * light[q] + c * light[r];
          const from = Math.round(a * row(p) + b * row(q) + c * row(r)) * map + Math.round(a * column(p) + b * column(q) + c * column(r));
          for (let i = 0; i < 3; i++) data[4 * at + i] = bright * colours[4 * from + i];
          data[4 * at + 3] = 255;
        }
      }
    }

    function move(right, up) {
      turn += right;
      tilt = Math.min(Math.max(tilt + up, 0.1), Math.PI / 2);
      if (!waiting) requestAnimationFrame(draw);
      waiting = true;
    }

    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) move(event.movementX / 150, event.movementY / 150);
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      if (!step) return;
      event.preventDefault();
      move(...step);
    });
    new ResizeObserver(() => move(0, 0)).observe(canvas);
    canvas.closest("figure").hidden = false;
  }
})();
