"""Operations: imports, builds, renders, publications and removals that a person or a program asked for and that an operation worker does."""
