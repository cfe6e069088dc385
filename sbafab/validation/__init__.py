"""Others' measurements with source, set-up and error; fits of the models; the paper's table."""
