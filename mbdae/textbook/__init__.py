"""Problems y' = f(t, y, z), 0 = g(t, y) of textbooks, on which methods are proven."""
