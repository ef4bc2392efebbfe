"""The shell of the app: window, session, settings, actions, docks, layouts, background tasks."""
