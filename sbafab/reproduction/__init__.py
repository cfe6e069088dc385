"""Every figure, table and number that the paper's text states, beside ours."""
