"""Self-contained pages: plots, program, platen and moves of a run or a comparison; live pages."""
