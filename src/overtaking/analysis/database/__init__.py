"""A data set as a database: questions in SQL, and the diagram of its entities and relations."""
