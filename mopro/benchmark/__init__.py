"""The hidden-effect proving ground: experiments whose answers are known and kept apart."""
