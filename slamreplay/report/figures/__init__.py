"""The report's pictures: drawn by matplotlib, one module per picture, no global state."""
