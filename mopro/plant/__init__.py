"""The plant: the machine's axes as equations of motion, and what integrates them."""
