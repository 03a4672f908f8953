"""What the command line tools share: texts, tables, pictures and live screens."""
