/**
 * The reference of the API: Swagger UI. Its requests carry the CSRF token, as the person's own requests do.
 */

const main = document.querySelector("main");
const token = document.querySelector('input[name="csrfmiddlewaretoken"]').value;
const root = document.querySelector("[data-part=reference]");

// The library makes a main of its own, within the page's, and has no setting for it: here it gets a div.
const create = document.createElement.bind(document);
document.createElement = (tag, options) => create(tag === "main" ? "div" : tag, options);

/** Correct levels of headings, which skip some, and links within buttons. */
function correctRoles() {
  for (const heading of root.querySelectorAll(".opblock-tag")) heading.ariaLevel = "2";
  for (const heading of root.querySelectorAll("h4")) heading.ariaLevel = "3";
  for (const link of root.querySelectorAll("button a[href]")) link.removeAttribute("href");
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
