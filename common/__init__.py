"""Code that stages share: errors in one line, whole files, tables of the fields of files, sources, a command's body."""
