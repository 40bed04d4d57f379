"""The site: pages, executed guides and notebooks, drawings and the reference, put together and built (`python -m notebooks.site`)."""
