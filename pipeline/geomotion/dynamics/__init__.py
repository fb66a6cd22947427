"""Contracting vector fields, the charts they live in, rollouts and certificates (thesis Ch. 5)."""
