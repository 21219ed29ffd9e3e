"""The paper's alternative method on a recorded log: adaptation driven by a prediction error."""
