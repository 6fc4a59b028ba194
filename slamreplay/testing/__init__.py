"""The public conformance kit, and a small synthetic bundle for tests of any stage."""
