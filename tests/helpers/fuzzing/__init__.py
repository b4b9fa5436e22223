"""Every parser of mopro as a function of bytes, with seeds, for the campaign `bench/fuzz.py`."""
