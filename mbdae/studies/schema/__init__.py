"""JSON Schemas of the files that users write, for editors that complete and check them."""
