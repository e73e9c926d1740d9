"""What the measurements share: running and weighing cases, tables, pictures, the document."""
