"""Configuration: files that ship with the package, YAML with positions, parameters with unit and range."""
