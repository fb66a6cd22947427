"""Fields without any promise, which contracting ones are compared with."""
