"""Configuration: shipped files, YAML with positions, parameters with unit and range."""
