"""Numbers and tables as people read them: what every room writes its sentences with."""
