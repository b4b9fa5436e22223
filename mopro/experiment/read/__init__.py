"""An experiment from its files: the file itself, its runs, their data and raw formats."""
