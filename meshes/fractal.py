"""Mesh of the stored curves: a coarse block under the demo surface.  python3 meshes/fractal.py [--h 0.12] [FILE]"""

from __future__ import annotations

import argparse
from pathlib import Path

import asperity as asp
from asperity.mesh.generate import build_block
from asperity.mesh.size_field import SizeField

L = 1e-6
DELTA = 0.03 * L  # to which the curves go: the mesh is fine where the flat comes


def main() -> None:
    """Write the mesh with the element size wanted in the contact."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=Path(__file__).with_suffix(".npz"))
    parser.add_argument("--h", type=float, default=0.12, help="element size in the contact, in units of L")
    arguments = parser.parse_args()
    surface = asp.Surface.from_spec(kind="weierstrass-mandelbrot", L=L, D=2.4, G=1.36e-11)
    size = SizeField.of(surface, DELTA, arguments.h * L, growth=0.6, h_max=0.4 * L)
    block = build_block(surface, height=L, size=size.at)
    block.save(arguments.file)
    print(f"{arguments.file}: {len(block.tets)} cells, {len(block.points)} nodes")


if __name__ == "__main__":
    main()
