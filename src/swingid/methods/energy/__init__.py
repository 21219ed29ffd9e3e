"""The paper's energy method: mirrored passes, as printed and better."""
