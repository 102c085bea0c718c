"""What people read of a job or a build: text, pages, pictures, films and tables."""
