//! What is where.

use axum::Router;
use axum::middleware::from_fn_with_state;
use axum::routing::get;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::{App, assets, export, guard, info, openapi, scene, sessions, socket, still};

/// The routes that the API's description lists: it is made from the same lines.
pub(super) fn api() -> OpenApiRouter<App> {
    OpenApiRouter::with_openapi(openapi::Description::openapi())
        .routes(routes!(info::healthz))
        .routes(routes!(info::readyz))
        .routes(routes!(info::metrics))
        .routes(routes!(info::openapi))
        .routes(routes!(info::schema))
        .routes(routes!(info::info))
        .routes(routes!(info::preset_list))
        .routes(routes!(info::preset))
        .routes(routes!(sessions::create, sessions::list))
        .routes(routes!(sessions::remove))
        .routes(routes!(sessions::control))
        .routes(routes!(scene::read, scene::replace, scene::patch))
        .routes(routes!(still::frame))
        .routes(routes!(export::field))
        .routes(routes!(socket::upgrade))
}

/// Everything that the server answers.
pub(super) fn router(app: &App) -> Router {
    let (api, _) = api().split_for_parts();
    api.route("/", get(assets::page))
        .route("/{*path}", get(assets::asset))
        .fallback(info::unknown_path)
        .method_not_allowed_fallback(info::unknown_method)
        .layer(from_fn_with_state(app.clone(), guard::guard))
        .with_state(app.clone())
}
