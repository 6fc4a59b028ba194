"""Tables and answers as CSV: one number a cell, and beside them what each column means."""
