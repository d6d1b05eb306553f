"""Plain data that describe what is computed: material, load path, settings, two bodies as one."""
