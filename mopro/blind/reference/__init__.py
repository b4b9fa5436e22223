"""Reference plant: the motor written a second time from its equations, importing no mopro."""
