"""The swingid command."""
