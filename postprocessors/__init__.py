"""The post-processors that come with drillc, one small file a controller."""
