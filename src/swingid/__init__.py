"""swingid: moment of inertia and bearing friction of a swinging body, from logged angles."""
