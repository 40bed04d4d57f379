"""The same work done with NumPy and with other libraries: one module per contestant."""
