"""What supervisors and staff set up: registry, profiles, webhooks, tokens, policies, groups, qualifications."""
