"""The site: pages, executed guides and notebooks, drawings and the reference; built by `python -m notebooks.site`."""
