"""Errors against time, of responses, of wear, of events and of integration in time."""
