"""Mesh of the block: element, sizes, generation by gmsh, distribution over the ranks."""
