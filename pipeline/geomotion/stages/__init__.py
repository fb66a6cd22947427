"""The steps of the pipeline: read artefacts, compute, write artefacts; and the commands that chain them."""
