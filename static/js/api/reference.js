/**
 * The reference of the API: Swagger UI. Its requests carry the CSRF token, as the person's own requests do.
 */

const main = document.querySelector("main");
const token = document.querySelector('input[name="csrfmiddlewaretoken"]').value;

globalThis.SwaggerUIBundle({
  url: main.dataset.schema,
  domNode: document.querySelector("[data-part=reference]"),
  deepLinking: true,
  docExpansion: "list",
  defaultModelsExpandDepth: 0,
  requestInterceptor: (request) => {
    if (new URL(request.url, location.href).origin === location.origin)
      request.headers["X-CSRFToken"] = token;
    return request;
  },
});
