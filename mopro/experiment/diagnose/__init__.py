"""An experiment through the diagnosis: its candidates, their starts, the verdict."""
