/**
 * The reference of the API: Swagger UI. Its requests carry the CSRF token, as the person's own requests do.
 */

const main = document.querySelector("main");
const token = document.querySelector('input[name="csrfmiddlewaretoken"]').value;
const root = document.querySelector("[data-part=reference]");

// The library makes a main of its own, within the page's, and has no setting for it: here it gets a div.
const create = document.createElement.bind(document);
document.createElement = (tag, options) => create(tag === "main" ? "div" : tag, options);

/** Correct what axe-core finds: levels of headings, links within buttons, fields without a name, examples out of reach. */
function correctRoles() {
  for (const heading of root.querySelectorAll(".opblock-tag")) heading.ariaLevel = "2";
  for (const heading of root.querySelectorAll("h4")) heading.ariaLevel = "3";
  for (const heading of root.querySelectorAll(".modal-ux-header h3")) heading.ariaLevel = "2";
  for (const close of root.querySelectorAll(".close-modal")) close.ariaLabel = gettext("Close");
  for (const button of root.querySelectorAll(".auth-btn-wrapper [aria-label]"))
    button.removeAttribute("aria-label"); // it is not what the button says
  for (const link of root.querySelectorAll("button a[href]")) link.removeAttribute("href");
  for (const example of root.querySelectorAll(".microlight")) example.tabIndex = 0; // it scrolls
  for (const responses of root.querySelectorAll(".responses-wrapper [role=region]"))
    responses.removeAttribute("role"); // each operation has one, of the same name
  for (const field of root.querySelectorAll("[data-param-name] :is(select, input, textarea)"))
    field.ariaLabel ||= field.closest("[data-param-name]").dataset.paramName;
}
new MutationObserver(correctRoles).observe(root, { childList: true, subtree: true });

globalThis.SwaggerUIBundle({
  url: main.dataset.schema,
  domNode: root,
  deepLinking: true,
  docExpansion: "list",
  defaultModelsExpandDepth: 0,
  requestInterceptor: (request) => {
    if (new URL(request.url, location.href).origin === location.origin)
      request.headers["X-CSRFToken"] = token;
    return request;
  },
});
