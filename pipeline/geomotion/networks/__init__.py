"""Networks that supply the functions the mathematics asks for."""
