"""Addresses of the pages of access."""

from django.urls import path

from robots.access.pages import courses, entries, joining, links, people, tokens
from robots.access.sign_in_rules.views import sign_in_rules

urlpatterns = [
    path("access/", people.my_access, name="my-access"),
    path("people/<uuid:person_id>/", people.person, name="person"),
    path("people/<uuid:person_id>/tokens/new/", tokens.service_token_new, name="service-token-new"),
    path("service-accounts/", tokens.service_accounts, name="service-accounts"),
    path("tokens/", tokens.my_tokens, name="tokens"),
    path("tokens/new/", tokens.token_new, name="token-new"),
    path("tokens/<uuid:token_id>/end/", tokens.token_remove, name="token-end"),
    path("robot-groups/", entries.groups, name="robot-groups"),
    path("robot-groups/<slug:slug>/people/", entries.group_people, name="robot-group-people"),
    path("sign-in-rules/", sign_in_rules, name="sign-in-rules"),
    path("qualifications/", entries.qualifications, name="qualifications"),
    path("courses/", courses.courses, name="courses"),
    path("courses/new/", courses.course_new, name="course-new"),
    path("courses/<slug:slug>/", courses.course, name="course"),
    path("courses/<slug:slug>/edit/", courses.course_edit, name="course-edit"),
    path("courses/<slug:slug>/archive/", courses.course_archive, name="course-archive"),
    path("courses/<slug:slug>/enrol/", courses.course_enrol, name="course-enrol"),
    path("courses/<slug:slug>/people/", courses.course_people, name="course-people"),
    path("courses/<slug:slug>/links/", links.course_links, name="course-links"),
    path("people/<uuid:person_id>/link/", links.person_link, name="person-link"),
    path("courses/<slug:slug>/invitations/", courses.invitation_new, name="invitation-new"),
    path("courses/<slug:slug>/invitations/<uuid:invitation_id>/", courses.invitation, name="invitation"),
    path(
        "courses/<slug:slug>/invitations/<uuid:invitation_id>/qr.svg",
        courses.invitation_qr,
        name="invitation-qr",
    ),
    path(
        "courses/<slug:slug>/invitations/<uuid:invitation_id>/revoke/",
        courses.invitation_revoke,
        name="invitation-revoke",
    ),
    path("join/<str:code>/", joining.join, name="join"),
    path("welcome/<str:code>/", joining.welcome, name="welcome"),
]
