"""Creates and removes scenes, files and renderings. A removal that was killed is completed before the name is used again."""
