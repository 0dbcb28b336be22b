"""Set-up by supervisors and staff: registry, profiles, webhooks, tokens, policies, groups, qualifications."""
