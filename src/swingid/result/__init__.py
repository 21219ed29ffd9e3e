"""The result of an identification: values, uncertainties, text, picture, file."""
