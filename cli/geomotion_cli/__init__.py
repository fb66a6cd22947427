"""The command line: `gms` and `ncds` find the verb, compose its configuration and call the pipeline."""
