"""Access control: people, devices and programs, their rights, credentials and sign-ins."""
