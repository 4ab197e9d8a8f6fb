"""Reference of topics, services and parameters, for ``--help`` and the pages of docs/."""
