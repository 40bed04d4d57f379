"""The site: pages, executed guides and notebooks, drawings, the reference; built by `python -m notebooks.site`."""
