"""Many logs side by side: tables that grow over days, and the page that is drawn from them."""
