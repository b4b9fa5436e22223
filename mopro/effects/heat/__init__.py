"""Terms missing in the heat balance of chapter 3.1."""
