"""What the stages share: errors in one line, whole files, the tables of what files hold, sources, a command's body."""
