
// Enlarges a figure of the report: + and - or the wheel zoom, dragging moves, Escape closes. Without it the page is whole.
(() => {
  const dialog = document.getElementById("zoom");
  if (!dialog || !dialog.showModal) return;
  const area = dialog.querySelector("div"), picture = area.appendChild(document.createElement("img"));
  let scale = 1;
  let drag = null;

  function zoom(factor, x = area.clientWidth / 2, y = area.clientHeight / 2) {
    const before = scale;
    scale = Math.min(Math.max(scale * factor, 1), 16);
    const left = area.scrollLeft + x, top = area.scrollTop + y;
    picture.style.width = `${100 * scale}%`;
    area.scrollLeft = (left * scale) / before - x;
    area.scrollTop = (top * scale) / before - y;
  }

  function open(image) {
    picture.src = image.src;
    picture.alt = image.alt;
    dialog.showModal();
    zoom(1 / scale);
    area.focus();
  }

  for (const image of document.querySelectorAll("figure img")) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Enlarge";
    button.setAttribute("aria-label", `Enlarge: ${image.alt}`);
    button.addEventListener("click", () => open(image));
    image.addEventListener("click", () => open(image));
    image.closest("figure").append(button);
  }
  const actions = { in: () => zoom(1.5), out: () => zoom(1 / 1.5), whole: () => zoom(1 / scale), close: () => dialog.close() };
  for (const button of dialog.querySelectorAll("button")) button.addEventListener("click", actions[button.value]);
  const keys = { "+": actions.in, "=": actions.in, "-": actions.out, 0: actions.whole };
  dialog.addEventListener("keydown", (event) => keys[event.key]?.());
  area.addEventListener("wheel", (event) => {
    event.preventDefault();
    const place = area.getBoundingClientRect();
    zoom(event.deltaY < 0 ? 1.2 : 1 / 1.2, event.clientX - place.left, event.clientY - place.top);
  }, { passive: false });
  area.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "mouse") return; // fingers scroll
    drag = [event.clientX + area.scrollLeft, event.clientY + area.scrollTop];
    area.setPointerCapture(event.pointerId);
  });
  area.addEventListener("pointermove", (event) => {
    if (drag) area.scrollTo(drag[0] - event.clientX, drag[1] - event.clientY);
  });
  area.addEventListener("pointerup", () => { drag = null; });
})();
