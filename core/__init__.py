"""What all packages use: the typed config and its composition, command lines, safe files, errors and spaces."""
