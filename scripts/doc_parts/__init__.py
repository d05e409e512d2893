"""Parts of the documentation, one module each; scripts/docs.py has the table of them."""
