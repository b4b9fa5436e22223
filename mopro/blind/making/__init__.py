"""Cases made from their specifications: programs, sizes, data, answers."""
