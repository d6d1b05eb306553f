"""Mesh of the block: element, element sizes, generation by gmsh, distribution over the ranks."""
