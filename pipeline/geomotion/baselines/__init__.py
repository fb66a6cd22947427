"""Methods of others and fields without any promise, which contracting ones are compared with."""
