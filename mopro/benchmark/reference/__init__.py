"""The plant written a second time, from its equations alone; shares no code with the emulator."""
